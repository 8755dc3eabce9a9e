"""Other ways than least squares to solve the equations τ = Φθ: what the literature tried."""

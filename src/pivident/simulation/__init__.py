"""What the machine would do: controllers, references, closed loop."""

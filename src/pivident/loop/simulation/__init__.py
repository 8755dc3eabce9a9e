"""What the machine would do: control laws, references, the closed loop."""

"""One picture of every effect that a diagnosis may name."""

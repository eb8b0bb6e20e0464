"""What the decisions mean: place, kind, sizes, and what the test runs say of them."""

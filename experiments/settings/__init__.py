"""What the settings of a diagnosis decide: each halved and doubled, on cases with a known truth."""

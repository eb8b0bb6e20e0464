"""What a diagnosis says: conclusions, every decision, progress, and all of it on disk."""

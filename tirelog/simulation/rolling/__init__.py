"""Truth of a tire that moves: finite elements on a hub, stepped through the whole log."""

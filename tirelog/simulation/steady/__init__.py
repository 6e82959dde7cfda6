"""Truth that is steady at every instant: beam and ring by difference operators."""

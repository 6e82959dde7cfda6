"""The response of the carcass: beam (P1, P2), ring (P3), its contact and stiffening."""

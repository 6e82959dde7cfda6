"""How far a verdict can be trusted: other draws, other logs, simulated cases."""

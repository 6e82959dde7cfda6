"""The least-squares fit of a model and the errors of its parameters."""

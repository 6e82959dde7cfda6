"""Pictures of models, and of what was found of them."""

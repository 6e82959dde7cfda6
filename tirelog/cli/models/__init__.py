"""Commands on models, and on what logs say of them."""

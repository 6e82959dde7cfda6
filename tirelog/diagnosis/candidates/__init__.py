"""Which effect it is: candidates, their signatures, what they remove, what parts them."""

"""Pictures made of characters: arrays in, lines of rich text out. Without colour the characters alone carry them."""

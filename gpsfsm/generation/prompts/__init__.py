"""What a model is asked: versioned templates, and what is put into them."""

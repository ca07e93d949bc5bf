"""Long products of matrices, taken from their factors and never multiplied out."""

"""The calculus of matrices by vectors in Kronecker layout (Khang, Dat, Tuan 2019)."""

from flexlin.kronecker.symbolic import derivative

__all__ = ["derivative"]

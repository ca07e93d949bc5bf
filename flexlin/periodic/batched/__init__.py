"""Many small periodic systems at once: every array keeps the systems on its last axis, so that loops run inside NumPy."""

from flexlin.periodic.batched.romberg import BatchedExponents, batched_exponents

__all__ = ["BatchedExponents", "batched_exponents"]

"""All exponents of many small second-order systems at once, M y'' + D y' + K y = 0: the kernel of `flexlin.sweep`.

Every array keeps the systems on its last axis, so that loops run inside NumPy. `flexlin.periodic.floquet_batch` is the other batch:
any A(t), given as samples, and the growth rate alone.
"""

from flexlin.periodic.batched.romberg import BatchedExponents, batched_exponents

__all__ = ["BatchedExponents", "batched_exponents"]

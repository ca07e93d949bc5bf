"""All exponents of many small second-order systems at once, M y'' + D y' + K y = 0: the kernel of `flexlin.answers.sweep`.

Every array keeps the systems on its last axis, so that loops run inside NumPy.
"""

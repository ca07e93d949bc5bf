"""Coefficients A(t), B(t) over one period as Fourier or Chebyshev series that agree with them everywhere: what all integration reads."""

"""Designs for other tools: python-control systems, C source, MATLAB, netCDF and NumPy files."""

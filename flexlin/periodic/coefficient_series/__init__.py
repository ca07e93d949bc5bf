"""The coefficients over one period as series that agree with them everywhere: what all integration reads."""

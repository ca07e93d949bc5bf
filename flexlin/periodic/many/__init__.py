"""All Floquet exponents of x' = A(t, p) x at many values of p, several at a time: the kernel of sweeps and scans."""

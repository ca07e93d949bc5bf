"""Where a periodic system that depends on parameters becomes unstable: critical values of one, boundary curves of two."""

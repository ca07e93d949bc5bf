"""Programs from outside on the same equations, for the studies: their right-hand sides are machine code, made and compiled here."""

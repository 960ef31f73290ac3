"""From expressions to numbers: tapes, their meaning in NumPy, and machine code through LLVM."""

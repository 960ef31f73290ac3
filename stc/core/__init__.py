"""The numerical core, written in C: a factorisation of KKT systems.  Read ``kkt.h`` first."""

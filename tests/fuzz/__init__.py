"""A fuzzer of the command line: spoilt specs, solutions, models, tables and options."""

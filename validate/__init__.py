"""Independent validation: reads a solution file and a MuJoCo model, and knows nothing of the solver."""

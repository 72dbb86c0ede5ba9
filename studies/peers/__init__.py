"""What the benchmark against peers is made of: contenders, their runs, figures."""

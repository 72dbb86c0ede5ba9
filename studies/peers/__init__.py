"""Parts of the benchmark against peers: contenders, their runs, figures."""

"""What noise remembers: autocorrelation times, autoregression, restricted likelihood."""

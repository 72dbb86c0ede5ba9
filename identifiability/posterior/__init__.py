"""Bayesian posterior of the parameters on the physical set.

What to use when:

- `target.Target` states the posterior: data, `Prior`, physical set, autocorrelation;
- `ensemble.sample_posterior` draws from it with emcee, and `diagnostics.diagnose_convergence`
  decides whether the draws may be shown;
- `diagnostics.measure_prior_sensitivity` asks whether the likelihood decides, or the prior at an
  edge;
- `exact.ExactSampler` walks without emcee;

The samplers need a start inside the set: ``physical.project.project(..., margin=1e-3).phi``.
"""

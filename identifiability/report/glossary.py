"""What the words of the reports mean, and where they come from."""

from __future__ import annotations

from identifiability.report.blocks import Term

VERDICTS = (
    Term(
        "identifiable",
        "Known well: its robust σ is below the limit, its sign is certain, and resampled logs "
        "agree. It may be used.",
        "identifiable",
    ),
    Term("weak", "Its sign is certain, its size is not.", "weak"),
    Term(
        "negligible",
        "Known to be about zero for this motion: nothing in its interval moves the torque of any "
        "joint noticeably. It may be left out. Not the same as unknown.",
        "negligible",
    ),
    Term(
        "not identifiable",
        "The logs do not determine it: zero and the other sign fit as well, or the motion cannot "
        "tell it from others.",
        "not identifiable",
    ),
    Term(
        "constraint-determined",
        "The logs leave it open, but bodies that can exist narrow it far below what the same logs "
        "and prior allow without them.",
        "constraint-determined",
    ),
    Term(
        "prior-dominated",
        "The logs leave it open, and its narrow posterior is little more than the prior around the "
        "robot file.",
        "prior-dominated",
    ),
    Term(
        "not judged",
        "The logs have too few independent outputs for so many parameters, or too few blocks of "
        "time to resample, to say anything. Longer logs or a higher cut-off mend that.",
        "not judged",
    ),
)

GLOSSARY = (
    *VERDICTS,
    Term(
        "ε_RA",
        "Relative torque error: what a model leaves, relative to how much the torque τ varies "
        "about its mean; τ̂ is the prediction, sums and mean run over samples and joints alike. "
        "On unseen motion it says what a prediction is worth, on fitted motion only how well the "
        "model bends [Díaz-Rodríguez et al. 2010, eq. 18].",
        formula="ε_RA = Σ |τ̂ − τ| ∕ Σ |τ − mean τ|",
    ),
    Term(
        "σ white",
        "Standard deviation of an estimate if residuals were independent from sample to sample.",
        formula="σ² = s² · diag (WᵀW)⁻¹",
    ),
    Term(
        "σ_robust",
        "The same when residuals resemble their predecessors, so that there are fewer independent "
        "samples than rows. The largest of three estimates: white σ times the root of the "
        "autocorrelation time, the spread of refits to resampled blocks of time, and the scatter "
        "of each column's scores over stretches of time, widened where there are few. Verdicts "
        "rest on it.",
        formula="σ_robust = max (σ · √(autocorrelation time), σ of the block bootstrap, "
        "σ of the scores · t/z)",
    ),
    Term(
        "autocorrelation time",
        "Number of consecutive samples that count as one independent sample; 1 for white noise.",
        formula="1 + 2 Σ ρ(lag)",
    ),
    Term(
        "10× rule",
        "The literature's rule: a parameter is identified if its white σ in percent is below ten "
        "times the smallest of the model [Khalil & Dombre 2002]. It is relative to the best "
        "parameter, so it gets looser as noise grows; it is shown beside the verdict, never "
        "instead of it.",
    ),
    Term(
        "base parameter",
        "A combination of masses, moments and friction that can be told apart by torque at all; "
        "it bears the name of one member of its group.",
    ),
    Term(
        "condition number",
        "Largest over smallest singular value of the regressor with columns of equal length: how "
        "much the least favourable combination magnifies errors.",
    ),
    Term(
        "physically possible",
        "Some real robot has the values: every body has a mass and an inertia that a distribution "
        "of mass can produce (its pseudo-inertia matrix is not negative [Wensing et al. 2018]), "
        "and no friction or rotor inertia is negative. The certificate is either such a robot, or "
        "a combination of the values that no robot can have.",
    ),
    Term(
        "posterior",
        "What is believed of the parameters after the data: prior times likelihood. The likelihood "
        "counts as many samples as are independent, and the noise variance is averaged over "
        "[Gelman et al. 2013]. With signs: flat prior, and what cannot be negative, such as "
        "friction, is not. With bodies: a normal prior per standard parameter around the robot "
        "file, and every body can exist.",
    ),
    Term(
        "contraction",
        "How much narrower a parameter is after the data than before: 0 where nothing was learned, "
        "1 where it is known exactly.",
        formula="contraction = 1 − posterior sd ∕ prior sd",
    ),
    Term(
        "standard parameter",
        "A mass, first moment or inertia of one body, or a friction or rotor inertia of one joint. "
        "Determined by data: data and prior narrow it without any constraint. By constraint: only "
        "bodies that can exist do. By prior: neither does. By structure: no motion shows it, so "
        "any narrowing comes from its neighbours in the same body.",
    ),
    Term(
        "convergence",
        "Several ensembles of walkers start apart. Nested R-hat near 1 says that they found the "
        "same distribution, effective draws how many independent ones the correlated draws are "
        "worth. Where a limit is missed, the numbers are withheld [Vehtari et al. 2021; Margossian "
        "et al. 2024].",
        formula="nested R-hat = √(1 + variance between ensembles ∕ variance within)",
    ),
    Term(
        "room of a body",
        "The smallest eigenvalue of its pseudo-inertia matrix in units of its own mass and size; "
        "below zero no distribution of mass produces it [Traversaro et al. 2016].",
    ),
    Term(
        "rounding",
        "The three highest digits of σ decide: up to 354 it keeps two digits, from 355 to 949 one, "
        "above it is rounded up to 1000 and keeps two; the value ends at the same decimal place "
        "[Particle Data Group 2024, sec. 5.3]. Results in JSON are not rounded.",
    ),
)

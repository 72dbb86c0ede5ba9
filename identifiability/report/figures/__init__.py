"""Figures as functions of arrays and labels; each returns a Matplotlib `Figure`.

What to use when: `parameters` for how well parameters are known, `belief` for what posteriors add,
`models` to compare models and for what the motion excites, `motion` for measured against predicted
torque and for what is left, `diagnosis`, `calibration` and `excitation` for their reports. `axes`
has what they share.
"""

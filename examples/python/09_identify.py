"""Identify mass and friction of a device from a recording of its motion and torques."""

from palpate import devices, identification

arm = devices.load("phantom-premium-1.5a")
recording = identification.simulate_experiment(arm, duration=5.0, seed=0)
fit = identification.estimate_parameters(recording, arm)
true = identification.true_values(arm, fit.parameters)
for row in identification.summary_rows(fit, true):
    print(f"{row['name']:4} {row['value']:10.4g}  [{row['low']:.4g}, {row['high']:.4g}] {row['unit']}")

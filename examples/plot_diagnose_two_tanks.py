"""
Two tanks, one level measured
=============================

Water is pumped into an upper tank, runs into a lower one and out. Only the lower level is measured;
the upper one is estimated with the model. The pump does nothing for small voltages, and the model
does not know.
"""

# %%
# The records
# -----------
# The machine hides a dead zone of the pump; X holds the pump's voltage, y the lower level.
from sklearn_pgnn import ModelDiagnosis, datasets

machine = datasets.make_two_tanks(random_state=0)
print(machine.prior.to_text())
print(machine.X.head(3))

# %%
# The diagnosis
# -------------
# The upper level is a state that no sensor shows: its start in every window is fitted along.
diagnosis = ModelDiagnosis(machine.prior).fit(machine.X, machine.y)
print(diagnosis.verdict_)
for cause in diagnosis.causes_:
    print(cause.effect, "on", cause.target, cause.parameters)
print("hidden was:", machine.effect)

# %%
# What could be the cause, and how much error power each candidate leaves alone, with its interval:
for effect, target, *share in diagnosis.candidates_:
    left, low, high = (100 * part for part in share)
    print(f"{effect:20} {target:8} {left:6.1f} % ({low:.1f} to {high:.1f})")

# %%
# Measured, prior and extended model.
display = diagnosis.plot()

"""
Which effect does the model of a golf robot miss?
=================================================

A golf robot is a driven pendulum. Its model knows dry friction that grows with the load, but not
that friction is higher at rest than in motion. The records come from a machine that sticks and
slips; the diagnosis sees the records and the model only, and the model's parameters are off by up
to seven per cent.
"""

# %%
# The records
# -----------
# Six records of ten seconds: the motor's torque and the measured angle with 1 mrad of noise. Only
# the first row of each trajectory tells a state.
from sklearn_pgnn import ModelDiagnosis, datasets

machine = datasets.make_hidden_effect(
    effect="stribeck_friction", n_records=6, sample_rate=125.0, random_state=1
)
print(machine.X.head(3))

# %%
# The diagnosis
# -------------
# Every cause of the catalogue is fitted together with the model's parameters; what counts is the
# error on windows that the parameters have not seen.
diagnosis = ModelDiagnosis(machine.prior).fit(machine.X, machine.y)
print(diagnosis.verdict_)
for cause in diagnosis.causes_:
    print(cause.effect, "on", cause.target, f"lowers the error by {cause.gain:.0f} %")
    for name, estimate in cause.parameters.items():
        print(f"  {name}: {estimate.low:.3g} to {estimate.high:.3g} {estimate.unit}")
print("hidden was:", machine.effect)

# %%
# The extended model
# ------------------
# It is a model like the first: it can be simulated, saved, and diagnosed again.
print(diagnosis.extended_model_.to_text())
gain = diagnosis.gain_["phi_measured"]
print(f"error: {gain.prior:.2g} rad, re-tuned {gain.refitted:.2g}, extended {gain.extended:.2g}")

# %%
# What the model got wrong, and what the extension makes of it.
display = diagnosis.plot()

# %%
# The same robot as ``python docs/make_pictures.py`` draws it:
#
# .. image:: /_static/diagnosis_golf_robot.png
#    :alt: Diagnosis of a golf robot: measured, prior and extended model
#
# sphinx_gallery_thumbnail_path = '_static/diagnosis_golf_robot.png'

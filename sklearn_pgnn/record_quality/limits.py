"""The settings of the checks: an error rate, thresholds for what is reported, and budgets."""

#: rate at which the check of one quantity speaks up although nothing is wrong; every test has this
#: one. Ten times smaller, and a fault must be larger by a tenth to a half to be found.
ALPHA = 1e-3
#: smallest share of a power, or of an uncertainty, that is worth saying; below it, a fault that is
#: there beyond doubt goes unsaid because it changes no verdict
SHARE = 0.05
#: how many times as large makes a difference between records, or between a record and a better one;
#: smaller, and records that differ as any two do are called different
TWICE = 2.0
#: how much must agree for a clock to be regular, or a signal to be noise, nearly everywhere; what
#: does not reach it is not judged
MOST = 0.9
#: correlation of neighbouring differences below which they are noise: it is -0.75 or less of white
#: noise and near 1 of a smooth signal; nearer to -0.75, and noisy signals are taken for smooth ones
NOISE_LIKE = -0.5
#: chance of equal neighbours from which on equal samples are no sign of a fault: rounding has then
#: made the estimate of the noise itself uncertain
COARSE = 0.2
#: no simulation, and no clock, is finer than this share of a signal's spread, or of a sample
FINE = 1e-5

# -- budgets: more costs time, less costs power ----------------------------------------------------

#: samples of a block in which differences are correlated
BLOCK = 64
#: samples into the past that a series is predicted from, and into the future that are compared
LAGS = 10
#: sines of the rich input that the record's own is compared with
SINES = 40
#: steps of a fit from a known minimum
STEPS = 8
#: rows at which an input is regressed on the states, and parts of them that are held out in turn
ROWS, FOLDS = 2000, 5
#: replays of an input at other speeds; fewer make the t test that compares with them blunter
REPLAYS = 10
#: samples to which parameters are fitted before a diagnosis, of longer records every n-th window,
#: and seconds of work after which that fit ends, or a search for lags
MOST_SAMPLES, HURRY = 20_000, 4.0
#: samples up to which records are simulated in finer steps
MOST_FINE = 200_000
#: width, in values of a parameter, within which that fit holds what the records do not tell
LOOSE = 3.0
#: most parameters that are named as collinear with one
SEVERAL = 4

"""Every number of estimation, diagnosis and experiment design: budgets, and limits of arithmetic.

None of them decides whether a cause is named: that is done by the user's `alpha` and
`smallest_share`. A larger budget costs time; a smaller one may miss a cause.
"""

# -- what is held out ------------------------------------------------------------------------------

#: folds of records. More cost as many fits; fewer leave less to learn from
FOLDS = 4
#: stretches where there are few records, and windows or groups of samples where there must be some.
#: More cost as many fits; fewer see what a record shows but a few times less surely
STRETCHES = 8
#: largest share of the windows that a fold may hold: more would leave too little to learn from
MOST_HELD_OUT = 2 / 3

# -- the ladder of fits ----------------------------------------------------------------------------

#: samples that a search works on; of longer records it takes stretches, and what it accepts is
#: judged on all. More cost time in proportion; fewer may leave out what happens seldom
LONG = 50_000
#: samples of a first fit, of a first look for a disturbance, of a regression and of a spectrum.
#: More cost time in proportion; fewer see less of a rare event
SAMPLES = 6000
#: steps on a rung of the ladder: at a start, on few windows, on some samples. More cost time in
#: proportion; after fewer the best may not yet be ahead
STEPS = 4
#: hypotheses that go on from a rung to one that costs more, and the part of the windows that the
#: rung below takes. More cost time in proportion; fewer may leave the best behind
KEPT = 4
#: pairs of candidates that are fitted. More cost time in proportion; fewer may miss a pair
PAIRS = 8
#: times the noise that causes may leave before costly moves are tried although nothing recorded
#: shows more, and beyond which a report is amber. Less costs time; more may miss a pair that short
#: records do not show
MUCH = 2.0
#: relative decrease of the objective at which a fit on all windows ends, and how much larger it is
#: on every rung below. Less costs steps; more leaves a fit short of its minimum
TOLERANCE, COARSER = 1e-4, 10.0
#: steps with which the accepted hypothesis is fitted on, also along directions that records hardly
#: see. Fewer leave its intervals off
POLISH_STEPS = 100

#: share of the least error so far below which a fit is told of while a search goes on. Larger tells
#: more often; no result depends on it
BETTER = 0.9
#: relative accuracy of an interval's ends. Finer costs fits
FINENESS = 0.1

# -- windows ---------------------------------------------------------------------------------------

#: error of the re-tuned prior, in units of the noise, above which shorter windows are tried. Larger
#: keeps windows longer: they show slow causes better, and fits have more local minima
FOLLOWED = 10.0
#: time constants in which a state, or an autocorrelation, forgets. More make windows longer and
#: autocorrelation times noisier; fewer cut off what is slow
FORGOTTEN = 5.0
#: shortest window, as a share of the dominant period: a shorter one shows a straight line
SHORTEST = 1 / 24

# -- limits of arithmetic --------------------------------------------------------------------------

#: finest error that counts, as a share of a signal's ups and downs: simulations are no finer
RESOLUTION = 1e-5
#: change of the outputs in units of the noise, or of a parameter in standard errors, that is small;
#: share of a fold's information on a direction below which the others do not determine it. A larger
#: one judges more by the fold's own data
SMALL_CHANGE = 0.1
#: relative size below which a direction is rounding
ROUNDING = 1e-9
#: random points at which expressions are compared. More cost time, fewer may meet limits only
POINTS = 20

# -- spectra ---------------------------------------------------------------------------------------

#: lines kept of a spectrum. More cost as many starts, fewer may miss the right one
LINES = 6
#: bins over which the background of a spectrum is taken: wider than a line, narrower than a slope
BACKGROUND = 41
#: step between the numbers of cycles over a range, as a share of the width of a line there
CYCLE_STEP = 0.2

# -- what is left ----------------------------------------------------------------------------------

#: trees of a regression, and leaves of each. More see finer structure and take longer
TREES, LEAVES = 50, 15
#: how long ago signals are looked at, in windows, or in the stretches of a record where these are
#: shorter. More see more kinds of memory and take longer
LAGS = (0.0, 1 / STRETCHES, 1 / 3, 1.0)
#: part of a formula term's effect on the outputs that re-tuning must leave: less cannot be told
#: from what is re-tuned
OWN = 0.02
#: most terms of a formula: more fit more, and say less
MOST_TERMS = 3
#: draws for an interval or a chance. More cost time and make it finer
DRAWS = 1000

# -- experiments -----------------------------------------------------------------------------------

#: decades of sizes that are looked at, and halvings of the last. More find smaller sizes, and more
#: exactly, for a re-tuning each
DECADES = 6
#: halvings and doublings of amplitudes and periods that are tried. More cost time in proportion
OCTAVES = 3
#: chance with which an experiment shall tell two causes apart: more takes more records
POWER = 0.9
#: times that an experiment is recorded at most: who would record it more often?
REPEATS = 10

"""Budgets of estimation, diagnosis and experiment design, and limits of arithmetic.

None of them decides whether a cause is named: this depends on the user's `alpha` and
`smallest_share`. A larger budget costs time; a smaller one may miss a cause.
"""

# -- what is held out ------------------------------------------------------------------------------

#: folds of records. More cost as many fits; fewer leave less to estimate from
FOLDS = 4
#: stretches where there are few records, and windows or groups of samples where there must be some.
#: More cost as many fits; fewer make rare events in a record less certain
STRETCHES = 8
#: largest share of the windows that a fold may hold: more would leave too little to estimate from
MOST_HELD_OUT = 2 / 3

# -- the ladder of fits ----------------------------------------------------------------------------

#: samples that a search works on; of longer records it uses stretches, and its result is
#: tested on all samples. Beside white noise on so many, the smallest share of the squares that
#: matters is far beyond doubt. More cost time in proportion; fewer may miss rare events
LONG = 20_000
#: samples of a first fit, of a first look for a disturbance, of a regression and of a spectrum.
#: More cost time in proportion; fewer show less of a rare event
SAMPLES = 6000
#: steps on a rung of the ladder: at a start, on few windows, on some samples. More cost time in
#: proportion; after fewer the best may not yet be ahead
STEPS = 4
#: hypotheses that continue from a rung to a more expensive one, and the share of the windows that
#: the rung below uses. More cost time in proportion; fewer may lose the best
KEPT = 4
#: pairs of candidates that are fitted. More cost time in proportion; fewer may miss a pair
PAIRS = 8
#: most sets of candidates of which all are fitted: those of four. More cost time in proportion
SETS = 2 * PAIRS
#: error in units of the noise above which costly moves are tried even if no recorded signal
#: explains the residuals, and above which a report is amber. Less costs time; more may miss a pair
#: that short records do not show
MUCH = 2.0
#: relative decrease of the objective at which a fit on all windows ends, and how much larger it is
#: on every rung below. Less costs steps; more stops a fit before its minimum
TOLERANCE, COARSER = 1e-4, 10.0
#: further steps of the fit of the accepted hypothesis, also along directions that the records
#: hardly determine. Fewer make its intervals inaccurate
POLISH_STEPS = 100

#: share of the least error so far below which a fit is reported during a search. Larger reports
#: more often; no result depends on it
BETTER = 0.9
#: relative accuracy of an interval's ends. Finer costs fits
FINENESS = 0.1

# -- windows ---------------------------------------------------------------------------------------

#: error of the re-tuned prior, in units of the noise, above which shorter windows are tried. Larger
#: keeps windows longer: they show slow causes better, and fits have more local minima
FOLLOWED = 10.0
#: time constants after which a state, or an autocorrelation, has decayed. More make windows longer
#: and autocorrelation times noisier; fewer cut off slow motion
FORGOTTEN = 5.0
#: shortest window, as a share of the dominant period: a shorter one shows only a straight line
SHORTEST = 1 / 24

# -- limits of arithmetic --------------------------------------------------------------------------

#: smallest error that counts, as a share of a signal's variation: simulations are no more accurate
RESOLUTION = 1e-5
#: change of the outputs in units of the noise, or of a parameter in standard errors, that is small;
#: share of a fold's information on a direction below which the others do not determine it. A larger
#: one relies more on the fold's own data
SMALL_CHANGE = 0.1
#: relative size below which a direction is rounding
ROUNDING = 1e-9
#: random points at which expressions are compared. More cost time; fewer may lie at limits only
POINTS = 20

# -- spectra ---------------------------------------------------------------------------------------

#: lines kept of a spectrum. More cost as many starts; fewer may miss the right one
LINES = 6
#: bins over which the background of a spectrum is taken: wider than a line, narrower than a slope
BACKGROUND = 41
#: step between the numbers of cycles over a range, as a share of the width of a line there
CYCLE_STEP = 0.2

# -- residuals -------------------------------------------------------------------------------------

#: trees of a regression, and leaves of each. More resolve finer structure and take longer
TREES, LEAVES = 50, 15
#: filters of every signal, by which a law may remember it. More show its memory more exactly and
#: take longer
FILTERS = 8
#: share of a formula term's effect on the outputs that must remain after re-tuning: less cannot be
#: distinguished from re-tuning
OWN = 0.02
#: quantities of which products are terms of a formula: those that alone explain most. More make
#: formulas of more kinds, and take time and memory by their square
MOST_QUANTITIES = 6
#: largest number of terms of a formula: more fit better, and explain less
MOST_TERMS = 3
#: draws for an interval or a probability. More cost time and make it more accurate
DRAWS = 1000

# -- experiments -----------------------------------------------------------------------------------

#: decades of sizes that are tried, and halvings of the last one. More find smaller sizes, and more
#: exactly, at the cost of a re-tuning each
DECADES = 6
#: halvings and doublings of amplitudes and periods that are tried. More cost time in proportion
OCTAVES = 3
#: probability with which an experiment shall separate two causes: more requires more records
POWER = 0.9
#: largest number of repetitions of an experiment: more are impractical
REPEATS = 10

"""Pictures of artefacts: every module draws one, for `qinit plot`, for reproductions and for reports.

    from qinit_cli.pictures import bars, car, curves, eopl, heatmaps, histograms, normality, occupancy

    heatmaps.drawn(paths of fits and runs)      what methods start from                       Figure 4
    histograms.drawn(path of sources)           Q and ln Q at some states                     Figures 5 and 10
    curves.drawn(runs)                          learning curves, a panel a distribution       Figures 6, 9, A2, A3
    bars.drawn(runs)                            averages by method and distribution           Figures 6 and 9
    occupancy.drawn(paths of sources)           states visited on the optimal paths           Figure 7
    eopl.drawn(paths of sources)                path lengths at the start, noise floor        Figure 8
    car.drawn(path of sources)                  the car, the hill and where the noise acts    Figure A1
    normality.drawn(path of a fit)              where ln Q is normal

Each gives back a `Drawn` (figures.drawn): `figure`, `title`, `alt` (a sentence with the main numbers), `notes` (what was left
out), `save(path)` and `svg()`. Paths are of artefacts; runs are `runs.Run`, as read from theirs. No option is needed: `width`
is `style.COLUMN` or `style.TEXT` in inches, `title` is None for the picture's own and "" for none.
"""

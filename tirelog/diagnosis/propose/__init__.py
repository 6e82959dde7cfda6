"""What is unknown, written down: a measured shape first, then formulas, in the model's language.

    pieces of all logs -> a third of the manoeuvres locked away before anything is looked at
        -> the search of `diagnose` on the rest: the same base, floor, nuisances and names
        -> nothing to propose if its verdict leaves nothing of size that repeats without a name
        -> `ground`     the residual beside base and nuisances, and what columns are worth there
        -> `measured_shapes`  free shapes, frame x law: the ceiling, and a shape as it is
        -> `scan`       the grammar frame x profile x stage x law: T of every form, p over all of
                        them by flips of manoeuvres; the best polished by variable projection
        -> `formulas`   the polished best refitted in the model; the simplest of those that leave
                        as little held out, the others named beside it; exponents rounded
        -> again on what is left, up to three terms
        -> the model with them, and its error on the locked manoeuvres: used once, for that number

`grammar` is data: a line more is a profile, a frame, a stage or a law more.
"""

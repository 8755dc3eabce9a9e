"""The experiment of Brunot, Janot, Young and Carrillo (2018) again, and their claims beside it.

`make_page` runs the experiment on a twin whose truth is the last column of the paper's Table 1,
and writes a page: the table, the figures, the code of every equation, and a verdict on every claim
of sections 5 and 6. The repetition over motions and noise is the study ``paper``.
"""

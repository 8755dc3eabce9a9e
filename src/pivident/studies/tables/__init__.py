"""Every table of pivident as columns, for pandas, polars, notebooks and sheets.

One convention for all: a row is one thing (a parameter, a joint of a sample, a test); units that
differ from row to row have a column of their own, ``unit`` or ``torque_unit``; a unit that all rows
share is in the column's name (``t_s``, ``rate_hz``, ``relative_std_percent``); estimates have
``low`` and ``high`` beside ``value``, at 2σ unless the column ``confidence`` says otherwise.
"""

"""One record, identified by MuJoCo's system identification toolbox and by pivident."""

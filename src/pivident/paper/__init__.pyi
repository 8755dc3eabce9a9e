from .experiment import Reading as Reading
from .experiment import run_reading as run_reading
from .page import make_page as make_page
from .published import PublishedParameter as PublishedParameter
from .published import published_table as published_table
from .repetition import Repetition as Repetition
from .repetition import Runs as Runs

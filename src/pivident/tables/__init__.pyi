from .chosen import Table as Table
from .chosen import TableError as TableError
from .chosen import table_names as table_names

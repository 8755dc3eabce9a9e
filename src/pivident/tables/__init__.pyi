from .chosen import table_names as table_names
from .columns import Table as Table
from .columns import TableError as TableError

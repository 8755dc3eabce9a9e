from .c_source import to_c as to_c
from .c_source import verify_c as verify_c
from .formats import export_model as export_model
from .formats import verify_export as verify_export
from .urdf import to_urdf as to_urdf

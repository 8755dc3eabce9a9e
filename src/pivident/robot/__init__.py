"""Robot descriptions: modified DH tables, URDF, transmission, friction laws, gallery."""

from pivident.robot.description import INERTIAL, Coupling, Joint, Link, Robot
from pivident.robot.drives import with_drives
from pivident.robot.friction import FrictionLaw, FrictionTerm
from pivident.robot.gallery import gallery_names, load_robot
from pivident.robot.modified_dh import parse_modified_dh, read_modified_dh
from pivident.robot.transmission import Transmission
from pivident.robot.urdf import parse_urdf, read_urdf

__all__ = [
    "INERTIAL",
    "Coupling",
    "FrictionLaw",
    "FrictionTerm",
    "Joint",
    "Link",
    "Robot",
    "Transmission",
    "gallery_names",
    "load_robot",
    "parse_modified_dh",
    "parse_urdf",
    "read_modified_dh",
    "read_urdf",
    "with_drives",
]

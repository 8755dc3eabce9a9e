from .closed_chains import closed_robot as closed_robot
from .constraints import (
    Closure as Closure,
    Constraints as Constraints,
    LinearConstraint as LinearConstraint,
)
from .description import Coupling as Coupling, Joint as Joint, Link as Link
from .drives import with_drives as with_drives
from .friction import (
    FrictionLaw as FrictionLaw,
    asymmetric_coulomb as asymmetric_coulomb,
    asymmetric_viscous as asymmetric_viscous,
    coulomb as coulomb,
    counterbalance as counterbalance,
    dahl as dahl,
    load_dependent as load_dependent,
    lugre as lugre,
    maxwell_slip as maxwell_slip,
    offset as offset,
    power_viscous as power_viscous,
    ripple as ripple,
    spring as spring,
    stribeck as stribeck,
    viscous as viscous,
)
from .friction_term import FrictionTerm as FrictionTerm
from .gallery import gallery_names as gallery_names
from .measured_base import (
    with_floating_base as with_floating_base,
    with_held_base as with_held_base,
    with_wrench_sensors as with_wrench_sensors,
)
from .mjcf import read_mjcf as read_mjcf
from .mjcf_actuators import ActuatorLaw as ActuatorLaw, actuator_law as actuator_law
from .modified_dh import (
    parse_modified_dh as parse_modified_dh,
    read_modified_dh as read_modified_dh,
)
from .transmission import Transmission as Transmission
from .urdf import parse_urdf as parse_urdf, read_urdf as read_urdf
from .wrench_sensor import WrenchSensor as WrenchSensor

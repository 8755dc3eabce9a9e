from .compliance import identify_compliance as identify_compliance
from .joint_study import rigid_validity as rigid_validity
from .multisine import identify_multisine as identify_multisine
from .resonance import find_resonance as find_resonance
from .simulated_joint import TwoMassJoint as TwoMassJoint
from .simulated_joint import simulate_joint as simulate_joint
from .two_mass import identify_two_mass as identify_two_mass

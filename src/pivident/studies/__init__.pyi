from . import figures as figures
from .collision.bodies import (
    Body as Body,
    Obstacle as Obstacle,
    Outline as Outline,
    ToolBox as ToolBox,
)
from .collision.clearances import Clearances as Clearances
from .collision.outlines import outline_of as outline_of
from .collision.room import (
    built_apart as built_apart,
    clearances_of_room as clearances_of_room,
    exact_distances as exact_distances,
)
from .comparison.compare import Comparison as Comparison
from .comparison.compared_results import (
    ComparedParameter as ComparedParameter,
    Difference as Difference,
)
from .excitation.design import (
    ClearanceUse as ClearanceUse,
    Design as Design,
    LimitUse as LimitUse,
    PredictedError as PredictedError,
)
from .excitation.design_file import (
    DesignFileError as DesignFileError,
    load_design as load_design,
    write_design as write_design,
)
from .excitation.design_motion import design_motion as design_motion
from .excitation.followed_motion import (
    FollowedMotion as FollowedMotion,
    followed_motion as followed_motion,
)
from .excitation.limits import JointLimits as JointLimits, joint_limits as joint_limits
from .excitation.motions import ExcitingMotion as ExcitingMotion, MotionFamily as MotionFamily
from .excitation.reached import (
    ReachedError as ReachedError,
    ReachedErrors as ReachedErrors,
    reached_errors as reached_errors,
)
from .excitation.request import DesignRequest as DesignRequest
from .figures import (
    FigureError as FigureError,
    figure_of_autocorrelations as figure_of_autocorrelations,
    figure_of_bandpass as figure_of_bandpass,
    figure_of_control_law as figure_of_control_law,
    figure_of_convergence as figure_of_convergence,
    figure_of_correlations as figure_of_correlations,
    figure_of_friction as figure_of_friction,
    figure_of_intervals as figure_of_intervals,
    figure_of_predictions as figure_of_predictions,
    figure_of_prefilters as figure_of_prefilters,
    figure_of_reference as figure_of_reference,
    figure_of_residual_spectra as figure_of_residual_spectra,
    figure_of_torques as figure_of_torques,
    figure_of_tracking as figure_of_tracking,
    save_figure as save_figure,
)
from .flexibility.compliance import identify_compliance as identify_compliance
from .flexibility.joint_study import rigid_validity as rigid_validity
from .flexibility.multisine import identify_multisine as identify_multisine
from .flexibility.resonance import find_resonance as find_resonance
from .flexibility.simulated_joint import (
    TwoMassJoint as TwoMassJoint,
    simulate_joint as simulate_joint,
)
from .flexibility.two_mass import identify_two_mass as identify_two_mass
from .friction.bearing_friction import bearing_friction as bearing_friction
from .friction.curves import write_friction as write_friction
from .friction.friction_study import (
    FrictionStudy as FrictionStudy,
    study_friction as study_friction,
)
from .friction.ripple_lines import NamedOrder as NamedOrder, remove_ripple as remove_ripple
from .friction.ripple_search import find_ripple as find_ripple
from .friction_laws.chosen_laws import LawChoice as LawChoice
from .friction_laws.law_candidates import adding as adding
from .friction_laws.law_choice import choose_laws as choose_laws
from .friction_laws.shapes import (
    ShapedIdentification as ShapedIdentification,
    identify_shapes as identify_shapes,
)
from .many.fleet.conclusion import conclude_fleet as conclude_fleet
from .many.fleet.identify_fleet import Fleet as Fleet, identify_fleet as identify_fleet
from .many.fleet.judgement import Judgement as Judgement
from .many.study.bench import Bench as Bench
from .many.study.conclusion import conclude_study as conclude_study
from .many.study.run import run_study as run_study
from .many.study.scenario import (
    Scenario as Scenario,
    load_scenario as load_scenario,
    read_scenario as read_scenario,
)
from .paper.experiment import Reading as Reading, run_reading as run_reading
from .paper.page import make_page as make_page
from .paper.published import (
    PublishedParameter as PublishedParameter,
    published_table as published_table,
)
from .paper.repetition import Repetition as Repetition, Runs as Runs
from .payload.arm_and_load import KnownParts as KnownParts
from .payload.identify_payload import identify_payload as identify_payload
from .payload.load_estimate import LoadEstimate as LoadEstimate
from .payload.payload_identification import PayloadIdentification as PayloadIdentification
from .prediction.new_logs import StoredResult as StoredResult, stored_result as stored_result
from .prediction.prediction import Prediction as Prediction
from .simulators.fit_simulator import fit_simulator as fit_simulator
from .simulators.held_out import HeldOut as HeldOut, held_out_errors as held_out_errors
from .simulators.robot_files import fitted_file as fitted_file
from .simulators.simulator_fit import FittedValue as FittedValue, SimulatorFit as SimulatorFit
from .tables.chosen import Table as Table, TableError as TableError, table_names as table_names

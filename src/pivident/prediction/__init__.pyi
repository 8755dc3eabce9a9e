from .prediction import Prediction as Prediction
from .prediction_page import write_csv as write_csv
from .prediction_page import write_html as write_html
from .stored_results import StoredResult as StoredResult
from .stored_results import stored_result as stored_result

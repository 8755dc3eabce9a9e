from .new_logs import StoredResult as StoredResult
from .new_logs import stored_result as stored_result
from .prediction import Prediction as Prediction
from .prediction_page import write_csv as write_csv
from .prediction_page import write_html as write_html

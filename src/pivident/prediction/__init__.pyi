from .new_logs import StoredResult as StoredResult
from .new_logs import stored_result as stored_result
from .prediction import Prediction as Prediction

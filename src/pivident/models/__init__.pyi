from .model_json import read_model as read_model
from .model_json import to_json as to_json
from .runnable_model import RunnableModel as RunnableModel
from .runnable_model import runnable_model as runnable_model
from .stored_model import stored_model as stored_model

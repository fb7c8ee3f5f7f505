"""Every symbol that the pipeline stores or plots, once: what it means and what it is measured in.

A revolute joint turns in rad and pushes in N m; a prismatic one slides in m and pushes in N.  Units are
therefore written with {position} and {effort}, and a joint fills them in.
"""

from typing import NamedTuple


class Quantity(NamedTuple):
    """The meaning of a symbol, for labels and schemas, and its unit."""

    meaning: str
    unit: str = "1"


QUANTITIES = {
    # what a record is about
    "log": Quantity("name of the recording in the study", ""),
    "joint": Quantity("name of the joint", ""),
    "role": Quantity("what the recording is for", ""),
    "group": Quantity("the joint, or the arm, that a model describes", ""),
    "model": Quantity("structure of the model", ""),
    "estimator": Quantity("how the parameters were found", ""),
    "filter": Quantity("how the external effort was tracked", ""),
    "signal": Quantity("which signal was tested", ""),
    "logs": Quantity("recordings that were pooled", ""),
    "scheme": Quantity("which data the prediction had not seen", ""),
    "stage": Quantity("stage that made a note", ""),
    "subject": Quantity("what a note is about", ""),
    "severity": Quantity("how much a note matters: error, warning or note", ""),
    "text": Quantity("what was noticed", ""),
    # how a log was read
    "format": Quantity("log format", ""),
    "files": Quantity("files of the log, in order", ""),
    "started": Quantity("date and time of the first sample, as the log gives it", ""),
    "zone": Quantity("time zone of the start", ""),
    "rows": Quantity("samples in the log"),
    "dropped": Quantity("rows that could not be used"),
    "backward": Quantity("times that go back"),
    "repeated": Quantity("times that stand still"),
    "duplicates": Quantity("rows equal to the one before, in every channel used"),
    "jitter": Quantity("standard deviation of the time between samples", "s"),
    "longest_gap": Quantity("longest time between two samples", "s"),
    "duration": Quantity("time from the first sample to the last", "s"),
    "facts": Quantity("what the reader found out about the file", ""),
    "warnings": Quantity("what the reader warned of", ""),
    "channel": Quantity("channel of the log", ""),
    "feeds": Quantity("quantity that the channel feeds; empty when it is not used", ""),
    "unit": Quantity("unit", ""),
    "nulls": Quantity("samples missing from the log"),
    "nans": Quantity("samples logged as NaN"),
    # motion and effort
    "rate": Quantity("sampling rate", "Hz"),
    "t": Quantity("time since the first sample", "s"),
    "q": Quantity("joint position", "{position}"),
    "dq": Quantity("joint velocity", "{position}/s"),
    "ddq": Quantity("joint acceleration", "{position}/s^2"),
    "tau": Quantity("actuator effort at the joint", "{effort}"),
    "tau_hat": Quantity("effort predicted by the model", "{effort}"),
    "stretch": Quantity("number of the stretch without a gap that a sample belongs to"),
    "held": Quantity("1 when the joint does not move during the recording, else 0"),
    "gaps": Quantity("interruptions of the recording"),
    "method": Quantity("how the recording was put on a uniform clock", ""),
    "velocity": Quantity("where the velocity comes from", ""),
    "value": Quantity("measured value", "{unit}"),
    # periods and noise
    "period": Quantity("length of one period", "s"),
    "period_std": Quantity("standard deviation of the period", "s"),
    "stated_period": Quantity("length of one period as the study states it; 0 where it does not", "s"),
    "periods": Quantity("number of periods averaged, M"),
    "count": Quantity("samples averaged at this phase"),
    "q_var": Quantity("variance of the position between periods", "{position}^2"),
    "dq_var": Quantity("variance of the velocity between periods", "({position}/s)^2"),
    "tau_var": Quantity("variance of the effort between periods", "{effort}^2"),
    "sigma_q": Quantity("standard deviation of the position noise", "{position}"),
    "sigma_dq": Quantity("standard deviation of the velocity noise", "{position}/s"),
    "sigma_tau": Quantity("standard deviation of the effort noise", "{effort}"),
    "q_noise": Quantity("position minus the mean of the periods", "{position}"),
    "dq_noise": Quantity("velocity minus the mean of the periods", "{position}/s"),
    "tau_noise": Quantity("effort minus the mean of the periods", "{effort}"),
    "harmonics": Quantity("harmonics kept of the position"),
    "frequency": Quantity("frequency", "Hz"),
    "amplitude": Quantity("amplitude of the position's spectrum", "{position}"),
    # parameters
    "parameter": Quantity("name of the model term", ""),
    "phi": Quantity("the model term, in Typst's mathematics", ""),
    "theta": Quantity("parameter of the model term", "see unit"),
    "theta_std": Quantity("standard deviation of theta, residuals taken as uncorrelated", "see unit"),
    "theta_std_hac": Quantity(
        "standard deviation of theta, allowing for correlated residuals (Newey-West)", "see unit"
    ),
    "mse": Quantity("mean squared error of the averaged effort", "{effort}^2"),
    "condition": Quantity("condition number of the regressor"),
    "samples": Quantity("number of samples fitted, K"),
    "hac_lags": Quantity("lags that the Newey-West errors allow for"),
    # predictions
    "rmse": Quantity("root mean squared error of the predicted effort", "{effort}"),
    "nrmse": Quantity("root mean squared error over the range of the effort"),
    "r2": Quantity("share of the effort's variance explained, R2"),
    "relative_error": Quantity("norm of the error over the norm of the effort, both low-passed alike"),
    # filtering
    "tau_ext": Quantity("external effort: what the robot exerts on the environment", "{effort}"),
    "tau_ext_std": Quantity("standard deviation of the external effort", "{effort}"),
    "tau_ext_direct": Quantity("effort minus the model's", "{effort}"),
    "tau_ext_rms": Quantity("root mean square of the external effort outside known contacts", "{effort}"),
    "innovation_q": Quantity("position innovation", "{position}"),
    "innovation_dq": Quantity("velocity innovation", "{position}/s"),
    "nis": Quantity("normalised innovation squared"),
    "nis_mean": Quantity("mean of the normalised innovation squared; 2 for a consistent filter"),
    "r_q": Quantity("standard deviation of the position noise that the filter assumes", "{position}"),
    "r_dq": Quantity("standard deviation of the velocity noise that the filter assumes", "{position}/s"),
    "q_dq": Quantity("standard deviation of the velocity's process noise per sample", "{position}/s"),
    "q_tau": Quantity("random walk of the external effort that the filter assumes", "{effort}/s^0.5"),
    # whiteness
    "lag": Quantity("lag", "samples"),
    "acf": Quantity("autocorrelation"),
    "acf1": Quantity("autocorrelation at lag 1"),
    "band": Quantity("95 % band of the autocorrelation of white noise"),
    "outside": Quantity("share of the lags outside the band"),
    "ljung_box": Quantity("Ljung-Box statistic"),
    "ljung_box_lags": Quantity("lags in the Ljung-Box statistic"),
    "ljung_box_p": Quantity("probability of a larger Ljung-Box statistic for white noise"),
    "jarque_bera_p": Quantity("probability of a larger Jarque-Bera statistic for normal noise"),
    "skewness": Quantity("skewness"),
    "kurtosis": Quantity("excess kurtosis"),
    "white": Quantity("1 when the test does not reject white noise at 1 %, else 0"),
    "all_white": Quantity("1 when every innovation of the filter passes, else 0"),
    "tested": Quantity("number of samples tested"),
}

"""Tests of the forecasts of wear."""

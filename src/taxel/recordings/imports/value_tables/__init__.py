"""Tables of values as people and instruments write them: texts, .npy and WAV."""

"""The paper's vibration experiment: stem and shaft in their steady states."""

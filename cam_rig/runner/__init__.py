"""The node graph as processes: started, monitored, ended."""

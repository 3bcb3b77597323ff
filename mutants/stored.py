def store(): pass
